"""The ground floor: errors and their wording, compiled code and its cache, files, checks, vectors."""
