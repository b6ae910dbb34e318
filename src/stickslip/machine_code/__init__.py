"""Machine code of compiled functions: made by LLVM, kept on disk, called from Python."""
