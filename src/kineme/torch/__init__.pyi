# Movements as functions of tensors
from kineme.torch.primitive import Primitive as Primitive
