"""Parameters that the paper does not print and we chose; in a file that does not load scikit-learn."""

from __future__ import annotations

#: Penalty of the SVM. The paper does not print its own; scikit-learn's 1 makes the RBF columns collapse.
PENALTY = 1000.0

#: Penalties for the table that shows why an SVM can land at 1 / 9.
PENALTIES = (1.0, 10.0, PENALTY)
