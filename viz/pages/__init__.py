"""Pages that a command leaves: Markdown, the HTML of the same content, and their figures in one folder."""
