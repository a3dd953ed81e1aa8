"""Cameras of this machine: listed, named and set.

In: the kernel's list of devices, a text that names a camera, wanted settings. Out: what a camera offers, its number,
and the settings that its driver answers.
"""

from cmpdesign.inputs.cameras.listing import ListedCamera as ListedCamera
from cmpdesign.inputs.cameras.listing import camera_of_path as camera_of_path
from cmpdesign.inputs.cameras.listing import find_camera as find_camera
from cmpdesign.inputs.cameras.listing import list_cameras as list_cameras
from cmpdesign.inputs.cameras.settings import CameraSettings as CameraSettings
from cmpdesign.inputs.cameras.settings import CameraState as CameraState
from cmpdesign.inputs.cameras.settings import set_camera as set_camera
