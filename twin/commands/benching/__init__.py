"""The verb `bench`, and what its page has to choose from."""
