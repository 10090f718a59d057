# Poses
from kineme.dmp.pose.pose_dmp import PoseDMP as PoseDMP
from kineme.dmp.pose.pose_dmp import PosePrimitives as PosePrimitives
from kineme.dmp.pose.pose_rollout import PoseRollout as PoseRollout
from kineme.dmp.pose.pose_controller import PoseController as PoseController
from kineme.dmp.pose.pose_controller import PoseState as PoseState
from kineme.features.movement_features import PoseFeatures as PoseFeatures
from kineme.dmp.pose.tangent import to_tangent as to_tangent
from kineme.dmp.pose.tangent import from_tangent as from_tangent

# Quaternions (w, x, y, z)
from kineme.movements.rotations import normalized as normalized
from kineme.movements.rotations import continuous as continuous
from kineme.movements.rotations import product as product
from kineme.movements.rotations import conjugate as conjugate
from kineme.movements.rotations import angle_between as angle_between
from kineme.movements.rotations import exp as exp
from kineme.movements.rotations import log as log
from kineme.movements.rotations import slerp as slerp
from kineme.dmp.pose.tangent import angular_velocity as angular_velocity
from kineme.dmp.pose.tangent import angular_acceleration as angular_acceleration
from kineme.dmp.pose.tangent import rotation_vector_rate as rotation_vector_rate
