"""Records episodes as datasets for those who learn from them.

Minari, the Farama Foundation's format for Gymnasium environments, keeps observations, actions,
rewards and infos of whole episodes in HDF5 and is read by the libraries for offline learning.
Actions are kept as they were applied, in single precision: played again from the variation in the
infos they give the same observations, bit for bit.

LeRobotDataset, Hugging Face's format for robots, keeps numbers in Parquet and what cameras see in
films, and is what policies of LeRobot are trained on.

A dataset of a custom task names the module of the task, which `recover_environment` imports.

Datasets have no reference scores for Minari's `get_normalized_score`, which scales the return. The
score of an episode is `infos["normalized_performance"][-1]`: it looks at the last step alone, and
in most tasks its bounds differ from variation to variation, so no two numbers make it of a return.
"""

from softgym_mj.recording.formats import dataset_name, make_format
from softgym_mj.recording.running import record

__all__ = ["dataset_name", "make_format", "record"]
