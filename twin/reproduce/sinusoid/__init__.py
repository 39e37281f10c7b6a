"""Figures 6 and 7: the sinusoid over modelling errors and over loads, beside what the paper prints."""
