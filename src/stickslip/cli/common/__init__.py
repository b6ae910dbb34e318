"""Common parts of commands: reading of models, output folders, exit codes."""
