"""What the page, the server and the workers say to each other, as plain data."""
