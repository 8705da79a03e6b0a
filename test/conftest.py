"""Settings and fixtures of all tests: ROS stays on this machine, checks field types and meets no other
session.
"""

import os

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"  # read when a message class is imported, so set before any test

import pytest
from hypothesis import settings

# No deadline, because the machine may be busy. Only HYPOTHESIS_PROFILE=search draws new examples.
settings.register_profile("repeatable", deadline=None, derandomize=True, print_blob=True)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


@pytest.fixture(scope="session")
def need_ros():
    """Skip the tests that need ROS where it is missing."""
    pytest.importorskip("rclpy")


@pytest.fixture(scope="session")
def ros_domain(need_ros):
    """A ROS domain that no other session on this machine uses, for this process and its children."""
    import domain_coordinator

    with domain_coordinator.domain_id() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        yield domain


@pytest.fixture
def graph(ros_domain):
    """An empty ROS graph; see :class:`ros_graph.Graph`."""
    from ros_graph import Graph

    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def shared_node(ros_domain):
    """A graph with one node for many tests, which must leave it unchanged."""
    from ros_graph import Graph

    graph = Graph()
    graph.serve()
    yield graph
    graph.close()
