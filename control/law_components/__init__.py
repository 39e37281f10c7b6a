"""Components shared by laws: parameters, feedback, sliding surface, observer, fuzzy approximator."""
