"""The measurement cell: drivers of robots and sensors, a virtual cell, and the process that measures.

A cell file (docs/reference/cell-file.md) names the arm, the drivers and their ports:

    cell = Cell.load("cell.toml")
    with Connected(cell.robot, cell.sensor):
        cell.robot.move_joints(readings)
        print(cell.sensor.measure())
"""

from truearm.cell.cell_file import Cell
from truearm.cell.device_errors import (
    DeviceError,
    DeviceGoneError,
    DeviceRestartedError,
    DeviceSilentError,
    EmergencyStopError,
    NotReadyError,
    PortUnavailableError,
    ProtectiveStopError,
    RefusedError,
    StoppedError,
)
from truearm.cell.protocols import Connected, Device, Managed, Robot, Sensor
from truearm.cell.reading import Expected, Reading

__all__ = [
    "Cell",
    "Connected",
    "Device",
    "DeviceError",
    "DeviceGoneError",
    "DeviceRestartedError",
    "DeviceSilentError",
    "EmergencyStopError",
    "Expected",
    "Managed",
    "NotReadyError",
    "PortUnavailableError",
    "ProtectiveStopError",
    "Reading",
    "RefusedError",
    "Robot",
    "Sensor",
    "StoppedError",
]
