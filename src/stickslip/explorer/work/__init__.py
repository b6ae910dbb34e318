"""What a worker computes for a page, one file for each question; ``python -m`` of this is one."""
