"""What a person looks at: recordings, live views, tables of figures."""

import os

# Rerun reads this when it is imported. What goes wrong is raised as an error; its own log would tell it once
# more, in lines of its own in the middle of a terminal.
os.environ.setdefault("RUST_LOG", "off")
