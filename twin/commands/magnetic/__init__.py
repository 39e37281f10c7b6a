"""The verbs below ``spheretwin magnetics``, one a file."""
