"""Things in a scene, each an entity with an MJCF model: cloth, rope, cups, marks, the arena."""
