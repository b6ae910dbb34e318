"""What all commands share: how models are read, folders written, ends said."""
