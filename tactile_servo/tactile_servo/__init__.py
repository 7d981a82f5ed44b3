"""Tactile servo: one supervisor, servo laws, edge map, controllers and robot motion."""
from tactile_common.exports import exported

__all__, __getattr__, __dir__ = exported(__name__, {
    'config': 'ServoConfig',
    'law': 'ServoLaw',
    'laws.registry': 'LAWS law_named',
    'motion.limits': 'JointLimits WorkspaceBox',
    'motion.motion': 'Motion',
    'motion.robot': 'RobotModel',
    'reasons': 'Reason ReasonCode',
    'supervisor': 'Supervisor',
    'types': 'EdgeGoal State Status',
})
