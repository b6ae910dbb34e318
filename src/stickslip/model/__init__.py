"""Systems: their declaration, and the format of model files."""
