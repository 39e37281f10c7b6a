"""What the table of a study says as a whole: a summary, figures and a page."""
