"""Sources of frames: pictures, videos, cameras, streams, and several of them as views. All commands read through here.

In: what ``inputs.sources`` names. Out: frames with times, and how the times were found.
"""

from cmpdesign.errors import SourceError as SourceError
from cmpdesign.tracking.sources.frame_source import FrameSource as FrameSource
from cmpdesign.tracking.sources.frame_source import Reading as Reading
from cmpdesign.tracking.sources.frame_source import SourceFrame as SourceFrame
from cmpdesign.tracking.sources.frame_source import SourceTimes as SourceTimes
from cmpdesign.tracking.sources.opening import open_named as open_named
from cmpdesign.tracking.sources.opening import open_source as open_source
from cmpdesign.tracking.sources.opening import open_sources as open_sources
from cmpdesign.tracking.sources.opening import split_list as split_list
from cmpdesign.tracking.sources.pictures import DEFAULT_FPS as DEFAULT_FPS
