# Recognition
from kineme.similarity.specification import Representation as Representation
from kineme.kernels.rotation import RotationPrior as RotationPrior
from kineme.recognition.answer import Answer as Answer
from kineme.recognition.early.hypotheses import Early as Early
from kineme.recognition.early.stream import Live as Live
from kineme.recognition.early.live_state import LiveState as LiveState
from kineme.recognition.monitor import Corridor as Corridor
from kineme.recognition.monitor import Execution as Execution
from kineme.recognition.monitor import Monitor as Monitor
from kineme.recognition.monitor import MonitorState as MonitorState
from kineme.recognition.differences import Confusion as Confusion
from kineme.recognition.differences import compare as compare
from kineme.recognition.differences import confusion as confusion
from kineme.recognition.explanation import Explanation as Explanation
from kineme.recognition.outliers import Outlier as Outlier
from kineme.recognition.outliers import Outliers as Outliers

__all__: list[str]
