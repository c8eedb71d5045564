"""Batches of environments: arrays, devices and the launcher of GPU kernels."""
