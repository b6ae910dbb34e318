"""A worker process: it reads requests from its standard input and writes answers to its output."""

from stickslip.explorer.work.loop import serve_pipe

if __name__ == "__main__":
    serve_pipe()
