# Movements as functions of tensors
from kineme.torch.primitive import Primitive as Primitive
from kineme.torch.policies import ActionChunk as ActionChunk
from kineme.torch.policies import Trajectories as Trajectories

# Similarities as losses
from kineme.torch.similarities import gram as gram
from kineme.torch.similarities import similarity as similarity
