"""The virtual force/torque sensor: wrenches from torques, frames, zero drift."""
