"""The ROS 2 package; ``colcon build`` installs it beside an installed cmpdesign."""

from setuptools import setup

NAME = "cmpdesign_ros"
setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/sensors.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    description="Tactile sensors with continuous marker patterns as ROS 2 topics.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"sensors = {NAME}.node:main"]},
)
