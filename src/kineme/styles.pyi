# Many demonstrations
from kineme.primitives.styles.average import average as average
from kineme.primitives.styles.average import average_by_label as average_by_label
from kineme.primitives.styles.average import AveragePrimitive as AveragePrimitive

# Styles
from kineme.primitives.styles.learn import learn_styles as learn_styles
from kineme.primitives.styles.model import StyleModel as StyleModel
from kineme.primitives.styles.model import StyleEstimate as StyleEstimate
