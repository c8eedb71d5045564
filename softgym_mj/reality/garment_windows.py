"""When recordings of garments count, what their cameras' delay is, what is held in a fling.

Numbers of RGBench's configuration (`configs/experiment_library.yaml` and `configs/cloth_params`,
repository hwk0809/RGBench, MIT licence), as they are: one delay of 0.474 s stands beside the remark
1/21.1 s, and some windows begin before or end after what is recorded.
"""

import dataclasses

# Folder, delay of the camera [s], begin and end [s] of what counts, after the joints' first stamp.
_TABLE = """
blue_dress_fling_2025-07-27-21-35-28 0.059880 0.0 3.14
blue_dress_fling_2025-07-27-21-35-44 0.059880 0.0 3.2
blue_dress_fling_2025-07-27-21-35-59 0.0609756 0.0 2.6
blue_dress_fling_2025-07-27-21-37-10 0.059880 0.1 4.9
blue_dress_fold_2025-07-28-17-47-46 0.0416666 7.0 11.2
blue_dress_fold_2025-07-28-17-49-12 0.0420168 6.6 11.0
blue_dress_fold_2025-07-28-14-43-26 0.045454 5.9 12.3
blue_dress_fold_2025-07-28-14-44-48 0.04 6.4 13.1
blue_dress_fold_2025-07-28-17-41-42 0.033333 5.0 9.7
blue_dress_fold_2025-07-28-17-43-49 0.033333 4.6 9.7
blue_dress_fold_2025-07-28-17-46-02 0.04 5.7 9.3
blue_dress_fold_2025-07-19-18-50-00 0.060976 3.3 7.6
blue_dress_grasp_2025-07-19-18-42-48 0.060976 5.0 10.0
blue_dress_grasp_2025-07-19-18-44-51 0.060976 3.5 6.8
blue_dress_grasp_2025-07-19-18-46-21 0.060976 3.3 7.9
green_tshirt_fling_2025-07-19-19-21-02 0.06024 2.0 5.3
green_tshirt_fling_2025-07-19-19-21-13 0.06024 0.1 3.0
green_tshirt_fling_2025-07-19-19-21-22 0.06024 0.1 3.5
green_tshirt_fold_2025-07-28-18-21-20 0.06024 5.4 9.9
green_tshirt_fold_2025-07-28-18-22-41 0.06024 7.0 11.2
green_tshirt_fold_2025-07-28-18-29-24 0.06024 6.8 12.4
green_tshirt_grasp_2025-07-19-19-14-03 0.06024 3.8 6.9
green_tshirt_grasp_2025-07-19-19-14-58 0.06024 4.0 7.9
green_tshirt_grasp_2025-07-19-19-16-11 0.06024 4.3 8.3
green_tshirt_grasp_2025-07-19-19-17-05 0.06024 4.5 8.6
grey_pleat_skirt_fling_2025-07-27-20-21-35 0.060976 0.1 4.7
grey_pleat_skirt_fling_2025-07-27-20-22-47 0.059524 0.1 3.0
grey_pleat_skirt_fling_2025-07-27-20-23-17 0.06024 0.1 2.5
grey_pleat_skirt_fling_2025-07-27-20-24-24 0.060976 1.6 4.7
grey_pleat_skirt_fling_2025-07-27-20-24-39 0.06024 1.5 4.5
grey_pleat_skirt_fold_2025-07-28-18-07-21 0.06024 5.5 9.3
grey_pleat_skirt_fold_2025-07-28-18-09-26 0.06024 6.4 10.6
grey_pleat_skirt_fold_2025-07-28-18-10-26 0.0591716 6.0 10.2
grey_pleat_skirt_grasp_2025-07-27-20-16-18 0.06024 6.5 8.0
grey_pleat_skirt_grasp_2025-07-27-20-19-21 0.06024 10.0 14.8
grey_pleat_skirt_grasp_2025-07-27-20-20-21 0.06024 9.5 14.6
white_cakeskirt_fling_2025-07-27-17-28-09 0.47393 0.0 3.2
white_cakeskirt_fling_2025-07-27-17-28-25 0.05 0.0 3.7
white_cakeskirt_fling_2025-07-27-17-29-47 0.049261 0.0 3.7
white_cakeskirt_fling_2025-07-27-17-32-29 0.047619 1.42 4.0
white_cakeskirt_fold_2025-07-28-17-38-10 0.04 7.0 11.5
white_cakeskirt_fold_2025-07-28-17-32-08 0.037037 6.0 11.8
white_cakeskirt_fold_2025-07-28-17-34-00 0.04 8.4 13.4
white_cakeskirt_fold_2025-07-28-17-36-17 0.03367 3.5 8.0
white_cakeskirt_fold_2025-07-28-17-39-24 0.035714 8.0 12.5
white_dress_grasp_2025-07-19-18-56-12 0.06024 4.8 8.6
white_dress_grasp_2025-07-19-18-58-06 0.06024 4.2 8.1
white_dress_grasp_2025-07-19-18-59-14 0.06024 4.7 8.3
white_dress_grasp_2025-07-19-19-00-47 0.06024 3.5 6.8
white_dress_grasp_2025-07-19-19-02-24 0.06024 3.7 7.5
white_shirt_fling_2025-07-18-20-53-39 0.0333333 0.0 3.8
white_shirt_fling_2025-07-18-20-53-53 0.0333333 0.0 4.5
white_shirt_fling_2025-07-18-20-54-05 0.0333333 0.0 4.2
white_shirt_fold_2025-07-28-18-34-10 0.0333333 7.5 11.7
white_shirt_fold_2025-07-28-18-36-00 0.0333333 7.5 11.7
white_shirt_fold_2025-07-28-18-37-24 0.0333333 7.3 11.4
white_shirt_grasp_2025-07-18-20-44-18 0.0333333 9.3 14.5
white_shirt_grasp_2025-07-18-20-45-25 0.0333333 9.3 16.0
white_shirt_grasp_2025-07-18-20-46-46 0.0333333 8.5 12.9
brown_coat_fling_2025-07-21-16-00-45 0.06024 0.0 4.13
brown_coat_fling_2025-07-21-16-00-59 0.06024 0.0 3.8
brown_coat_fling_2025-07-21-16-01-11 0.06024 0.0 3.34
brown_coat_fold_2025-07-28-17-56-25 0.06024 6.0 9.8
brown_coat_fold_2025-07-28-17-52-15 0.052631 8.5 14.2
brown_coat_fold_2025-07-28-17-54-16 0.06024 3.9 8.7
brown_coat_fold_2025-07-28-17-59-34 0.06024 7.0 11.3
brown_coat_grasp_2025-07-21-15-53-00 0.050251 1.4 5.0
brown_coat_grasp_2025-07-21-15-54-20 0.06024 5.5 9.8
brown_coat_grasp_2025-07-21-15-55-44 0.06024 5.0 9.7
beige_hoodie_fling_2025-07-18-17-55-01 0.06024 0.0 3.7
beige_hoodie_fling_2025-07-18-17-55-11 0.06024 0.0 3.5
beige_hoodie_fling_2025-07-18-17-55-22 0.06024 0.0 3.7
beige_hoodie_fold_2025-07-28-18-15-54 0.038461 6.0 9.9
beige_hoodie_fold_2025-07-28-18-17-38 0.038461 8.0 12.1
beige_hoodie_fold_2025-07-28-18-19-16 0.038461 8.0 12.2
beige_hoodie_fold_2025-07-28-18-13-17 0.038461 6.1 11.3
beige_hoodie_grasp_2025-07-18-17-33-48 0.0333333 8.6 14.8
beige_hoodie_grasp_2025-07-18-17-37-37 0.0384615 11.5 16.8
beige_hoodie_grasp_2025-07-18-17-42-27 0.0625 14.0 18.8
blazer_fling_2025-07-19-18-31-44 0.06024 0.0 2.6
blazer_fling_2025-07-19-18-31-53 0.06024 0.0 2.7
blazer_fling_2025-07-19-18-32-01 0.06024 0.0 3.8
blazer_fold_2025-07-19-18-29-10 0.06024 3.2 9.1
blazer_fold_2025-07-19-18-29-58 0.06024 5.5 10.3
blazer_fold_2025-07-19-18-31-00 0.06024 2.5 6.8
blazer_grasp_2025-07-19-18-24-01 0.06024 4.3 8.3
blazer_grasp_2025-07-19-18-24-57 0.06024 4.0 7.7
blazer_grasp_2025-07-19-18-26-27 0.06024 3.0 6.8
blazer_grasp_2025-07-19-18-27-26 0.06024 3.6 7.0
blazer_grasp_2025-07-19-18-28-21 0.06024 2.4 5.0
sunwear_fling_2025-07-19-18-04-35 0.06024 0.0 3.9
sunwear_fling_2025-07-19-18-04-52 0.06024 0.0 4.6
sunwear_fling_2025-07-19-18-05-04 0.06024 0.0 3.9
sunwear_fold_2025-07-19-18-00-32 0.06024 7.5 11.0
sunwear_fold_2025-07-19-18-02-01 0.06024 4.3 8.0
sunwear_fold_2025-07-19-18-03-11 0.06024 7.0 10.7
sunwear_grasp_2025-07-19-17-47-32 0.06024 7.6 11.5
sunwear_grasp_2025-07-19-17-49-04 0.06024 4.8 9.5
"""

# Vertices of the meshes, by their files' order, that hands hold in a fling: left and right.
SHOULDERS = {
    "beige_hoodie": (4445, 1232),
    "brown_coat": (6545, 20316),
    "green_tshirt": (185, 76),
    "grey_pleat_skirt": (155, 9799),
    "grey_sunwear": (22261, 19654),
    "khaki_blazer": (11873, 8509),
    "white_cakeskirt": (9694, 9782),
    "white_shirt": (3559, 8814),
}

# The mesh that these are of, and that the benchmark simulates, by the end of its path.
MESHES = {
    "beige_hoodie": "Beige_Hoodie/beige_hoodie_25k.obj",
    "brown_coat": "Brown_Coat/brown_coat_33k.obj",
    "green_tshirt": "Green_Tshirt/green_tshirt_10k.obj",
    "grey_pleat_skirt": "Grey_Pleat_Skirt/grey_pleat_skirt_20k.obj",
    "grey_sunwear": "Grey_Sunwear/grey_sunwear.obj",
    "khaki_blazer": "Khaki_Blazer/khaki_blazer.obj",
    "white_cakeskirt": "White_CakeSkirt/white_cakeskirt_40k.obj",
    "white_shirt": "White_Shirt/white_shirt_30k.obj",
}


@dataclasses.dataclass(frozen=True)
class Window:
    """What of a recording counts.

    Attributes:
        delay: of the camera [s].
        begin, end: after the joints' first stamp [s].
    """

    delay: float
    begin: float
    end: float


WINDOWS = {
    name: Window(*map(float, values))
    for name, *values in (line.split() for line in _TABLE.strip().splitlines())
}
