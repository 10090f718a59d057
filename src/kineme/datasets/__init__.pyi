# Handwriting
from kineme.datasets.lasa import load_lasa as load_lasa
from kineme.datasets.lasa import LASA_26 as LASA_26
from kineme.datasets.lasa import LASA_30 as LASA_30
from kineme.datasets.lasa import PAPER_LETTERS as PAPER_LETTERS

# To begin with
from kineme.datasets.examples import load_example as load_example
from kineme.datasets.examples import EXAMPLES as EXAMPLES
