"""The virtual force/torque sensor: torques to wrenches, frames, zero drift, sensors, contacts."""
