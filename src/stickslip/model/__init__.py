"""What a system is, how it is declared, and its language of files."""
