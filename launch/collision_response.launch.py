"""Start the node and, if requested, the nodes that publish body states and markers.

ros2 launch collision_response collision_response.launch.py states:=true markers:=true
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import EnvironmentVariable, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "collision_response"
CONFIG = PathJoinSubstitution([FindPackageShare(PACKAGE), "config"])
PARAMETERS = PathJoinSubstitution([CONFIG, "collision_response.yaml"])

JAZZY = os.environ.get("ROS_DISTRO") == "jazzy"  # ROS Jazzy has Fast DDS 2
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE" if JAZZY else "FASTDDS_DEFAULT_PROFILES_FILE"
PROFILE = "fast_dds_2.xml" if JAZZY else "fast_dds.xml"  # docs/reliability.md says why


def generate_launch_description() -> LaunchDescription:
    """Describe the launch. ``ros2 launch --show-args`` lists the arguments."""

    def node(executable: str, **options: object) -> Node:
        use_sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
        return Node(
            package=PACKAGE,
            executable=executable,
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file"), {"use_sim_time": use_sim_time}],
            additional_env={
                PROFILES: EnvironmentVariable(PROFILES, default_value=PathJoinSubstitution([CONFIG, PROFILE]))
            },
            output="screen",
            **options,
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file", default_value=PARAMETERS, description="file with the parameters of all nodes"
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of all nodes"),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="whether to take the time from /clock"
            ),
            DeclareLaunchArgument(
                "states", default_value="false", description="whether to publish body states from odom or TF"
            ),
            DeclareLaunchArgument(
                "markers",
                default_value="false",
                description="whether to publish answers for RViz or Foxglove",
            ),
            node("collision_response_node", respawn=True, respawn_delay=1.0),
            node("collision_response_states", condition=IfCondition(LaunchConfiguration("states"))),
            node("collision_response_markers", condition=IfCondition(LaunchConfiguration("markers"))),
        ]
    )
