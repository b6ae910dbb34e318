"""A worker process: questions come in on its standard input, answers go out on its output."""

from stickslip.explorer.work.loop import serve_pipe

if __name__ == "__main__":
    serve_pipe()
