"""How stable a law is beyond its proof: descent, reaching, drift over ten minutes, and margins."""
