"""Parts that can fail, one a file, each with the modes in which it does, and their list."""
