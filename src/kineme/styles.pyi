# Many demonstrations
from kineme.dmp.styles.average import average as average
from kineme.dmp.styles.average import average_by_label as average_by_label
from kineme.dmp.styles.average import AveragePrimitive as AveragePrimitive

# Styles
from kineme.dmp.styles.model import learn_styles as learn_styles
from kineme.dmp.styles.model import StyleModel as StyleModel
from kineme.dmp.styles.model import StyleEstimate as StyleEstimate
