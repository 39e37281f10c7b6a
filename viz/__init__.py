"""What a person looks at: recordings, live views, tables of figures."""
