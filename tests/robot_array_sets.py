"""Small sets of robots in the layouts of robomimic, ALOHA, UMI and Diffusion Policy, written by h5py and zarr."""

from __future__ import annotations

import json

import numpy as np

LENGTHS = (30, 40, 50)


def motion(k, n, width):
    """Positions (n, width) that differ from episode to episode."""
    u = np.linspace(0, 1, n)
    return np.stack([np.sin((2 + j) * u + k) + 0.1 * j for j in range(width)], axis=1)


def write_robomimic(path, lengths=LENGTHS, **env_kwargs):
    """One file, as robomimic's ``dataset_states_to_obs.py`` leaves it: observations with images, filter keys."""
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["total"] = sum(lengths)
        kwargs = {"robots": ["Panda"]} | (env_kwargs or {"control_freq": 20})
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "type": 1, "env_kwargs": kwargs})
        for k, n in enumerate(lengths):
            demo = data.create_group(f"demo_{k}")
            demo.attrs["num_samples"], demo.attrs["model_file"] = n, "<mujoco/>"
            demo["actions"], demo["states"] = np.clip(motion(k, n, 7), -1, 1), motion(k, n, 32)
            demo["rewards"], demo["dones"] = np.zeros(n), np.zeros(n)
            for part in ("obs", "next_obs"):
                group = demo.create_group(part)
                group["robot0_eef_pos"], group["robot0_eef_quat"] = motion(k, n, 3), motion(k, n, 4)
                group["robot0_gripper_qpos"], group["object"] = motion(k, n, 2), motion(k, n, 10)
                group.create_dataset("agentview_image", data=np.zeros((n, 24, 24, 3), np.uint8), compression="gzip")
        file["mask/train"], file["mask/valid"] = np.array([b"demo_0", b"demo_2"]), np.array([b"demo_1"])
    return path


def write_aloha(folder, lengths=LENGTHS, n_joints=14):
    """A folder with a file for each episode, as ``record_sim_episodes.py`` of ACT writes it."""
    import h5py

    folder.mkdir()
    for k, n in enumerate(lengths):
        with h5py.File(folder / f"episode_{k}.hdf5", "w") as root:
            root.attrs["sim"] = True
            obs = root.create_group("observations")
            image = obs.create_group("images")
            image.create_dataset("top", (n, 48, 64, 3), dtype="uint8", chunks=(1, 48, 64, 3))
            for name, group in (("qpos", obs), ("qvel", obs), ("action", root)):
                group.create_dataset(name, (n, n_joints), dtype="f4")[...] = motion(k, n, n_joints) + 0.01 * len(name)
    return folder


def write_buffer(path, arrays, lengths=LENGTHS, tall=None, **options):
    """A replay buffer in Zarr 2: arrays one episode behind the other, their ends; a folder, or an archive for .zip."""
    import zarr

    is_archive = path.suffix == ".zip"
    store = zarr.storage.ZipStore(str(path), mode="w") if is_archive else zarr.storage.LocalStore(str(path))
    root = zarr.open_group(store, mode="w", zarr_format=2)
    named = {f"data/{name}": values for name, values in arrays.items()} | {"meta/episode_ends": np.cumsum(lengths)}
    for name, values in named.items():
        how = {"compressors": None} | options if name.startswith("data") else {}
        if tall is not None:
            how["chunks"] = (tall, *values.shape[1:])
        root.create_array(name, shape=values.shape, dtype=values.dtype, **how)[...] = values
    store.close()
    return path


def write_umi(path, lengths=LENGTHS, **options):
    """A replay buffer of one gripper, as ``07_generate_replay_buffer.py`` of UMI saves it."""

    def joined(width):
        return np.concatenate([motion(k, n, width) for k, n in enumerate(lengths)])

    arrays = {f"robot0_{name}": joined(3).astype(np.float32) for name in ("eef_pos", "eef_rot_axis_angle")}
    arrays |= {"robot0_gripper_width": joined(1).astype(np.float32)}
    arrays |= {f"robot0_demo_{name}_pose": joined(6) for name in ("start", "end")}
    arrays |= {"camera0_rgb": np.zeros((sum(lengths), 16, 16, 3), np.uint8)}
    return write_buffer(path, arrays, lengths, **options)
