"""The security policy matches the node, and no external data is executed."""

from __future__ import annotations

import ast
from pathlib import Path
from xml.etree import ElementTree

import pytest

import collision_response

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = Path(collision_response.__file__).parent
POLICY = ROOT / "security" / "policy.xml"


def allowed(name: str, kind: str) -> list[str]:
    """Names in the policy as written: ``topics`` or ``services`` with this permission."""
    (profile,) = ElementTree.parse(POLICY).iterfind("enclaves/enclave/profiles/profile")
    return [entry.text for group in profile.iterfind(name) if group.get(kind) == "ALLOW" for entry in group]


class TestPolicy:
    """security/policy.xml and a running node."""

    @pytest.mark.parametrize(
        ("kind", "permission", "query"),
        [
            ("topics", "publish", "get_publisher_names_and_types_by_node"),
            ("topics", "subscribe", "get_subscriber_names_and_types_by_node"),
            ("services", "reply", "get_service_names_and_types_by_node"),
            ("services", "request", "get_client_names_and_types_by_node"),
        ],
    )
    def test_it_allows_exactly_what_the_node_has(self, graph, kind, permission, query):
        node = graph.serve(use_sim_time=True)
        has = {name for name, _ in getattr(node, query)(node.get_name(), node.get_namespace())}
        resolve = node.resolve_service_name if kind == "services" else node.resolve_topic_name
        may = {resolve(name) for name in allowed(kind, permission)}
        assert sorted(has - may) == [], f"missing in the policy, to {permission}"
        assert sorted(may - has) == [], f"the node has no such thing to {permission}"

    def test_it_has_the_name_of_the_node(self, graph):
        tree = ElementTree.parse(POLICY)
        (enclave,) = tree.iterfind("enclaves/enclave")
        (profile,) = enclave.iterfind("profiles/profile")
        assert profile.get("node") == graph.serve().get_name() == enclave.get("path").strip("/")
        assert tree.getroot().get("version") == "0.2.0"
        assert {group.tag for group in profile} == {"topics", "services"}


RUNS_CODE = {"pickle", "marshal", "shelve", "dill", "joblib", "code", "codeop"}


@pytest.mark.parametrize(
    "file", sorted(PACKAGE.rglob("*.py")), ids=lambda file: str(file.relative_to(PACKAGE))
)
def test_no_external_data_is_executed(file):
    """No module that turns data into code, and no shell; exec and eval only where the build makes kernels."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            assert not RUNS_CODE & {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            assert node.module.partition(".")[0] not in RUNS_CODE
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in {"eval", "exec", "compile", "__import__", "os.system"}, called
            assert not any(keyword.arg in ("shell", "allow_pickle") for keyword in node.keywords)
