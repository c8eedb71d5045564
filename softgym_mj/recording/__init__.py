"""Records episodes as datasets for offline and imitation learning.

Minari, the Farama Foundation's format for Gymnasium environments, stores observations, actions,
rewards and infos of whole episodes in HDF5. Actions are the applied ones in single precision:
replayed from the variation in the infos, they give the same observations, bit for bit.

LeRobotDataset, Hugging Face's format for robots, stores numbers in Parquet and images as videos.

A dataset of a custom task names the module of the task, which `recover_environment` imports.

Datasets have no reference scores for Minari's `get_normalized_score`, which scales the return. The
score of an episode is `infos["normalized_performance"][-1]`; it depends on the last step alone, and
in most tasks its bounds differ between variations.
"""

from softgym_mj.recording.formats import dataset_name, make_format
from softgym_mj.recording.running import record

__all__ = ["dataset_name", "make_format", "record"]
