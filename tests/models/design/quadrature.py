"""Direct sums with a third of the standard points: errors of a thousandth tell right from wrong."""

from spheretwin.models.design.direct_summation import Quadrature, Rule

COARSE = Quadrature(near=Rule(8, 8, 32, 8), far=Rule(6, 6, 24, 4))
