"""The functions of a system as machine code: LLVM's assembly language, written from the tape and
from the routines."""
