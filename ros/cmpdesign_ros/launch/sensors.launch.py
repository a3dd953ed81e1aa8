"""ros2 launch cmpdesign_ros sensors.launch.py sensors:="[thumb.toml, index.toml]" """

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """One node for all sensors."""
    names = {
        "sensors": "sensor files",
        "outputs": "of markers, shape and contact; empty: all that a file allows",
    }
    arguments = [
        DeclareLaunchArgument(name, default_value="['']", description=text) for name, text in names.items()
    ]
    parameters = [{name: LaunchConfiguration(name) for name in names}]
    node = Node(package="cmpdesign_ros", executable="sensors", name="cmpdesign", parameters=parameters)
    return LaunchDescription([*arguments, node])
