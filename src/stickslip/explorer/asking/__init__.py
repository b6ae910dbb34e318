"""Messages between the page, the server and the workers, as plain data."""
