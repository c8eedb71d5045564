"""Arms as actors: models, kinematics, controllers, grasps and action spaces."""
