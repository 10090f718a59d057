"""Behavior trees in the XML of BehaviorTree.CPP 4, which py_trees reads, too: of a plan, or of a domain's operators.

Actions are nodes with ports: the arguments of an operator, start and goal of the hand, and the duration. Of a domain,
each operator is a subtree: nothing is done where its effects hold already, else its preconditions are checked first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from kineme.planning.domain import Domain, Literal, Operator
from kineme.planning.pddl import Names
from kineme.planning.plan import Plan

_ROOT = {"BTCPP_format": "4"}
#: Nodes that a reader knows itself: a symbol of that name is called otherwise.
_OWN = {
    "Sequence", "Fallback", "Selector", "Parallel", "Inverter", "SubTree", "Subtree", "BehaviorTree", "Include",
    "Import", "Action", "Condition", "Control", "Decorator", "Repeat", "Retry", "Timeout", "Delay", "Script",
    "Switch", "Sleep",
    "ForceSuccess", "ForceFailure", "AlwaysSuccess", "AlwaysFailure", "IfThenElse", "WhileDoElse", "ReactiveSequence",
    "ReactiveFallback", "RetryUntilSuccessful", "KeepRunningUntilFailure", "RunOnce", "SetBlackboard", "TreeNodesModel",
}  # fmt: skip


def plan_to_behavior_tree(plan: Plan) -> str:
    """Return a plan as a behavior tree: its steps one after the other."""
    domain = plan.problem.domain
    names = Names(domain, plan.problem.objects)
    nodes = node_ids(names)
    root = Element("root", {**_ROOT, "main_tree_to_execute": "Plan"})
    sequence = SubElement(SubElement(root, "BehaviorTree", {"ID": "Plan"}), "Sequence", {"name": "plan"})
    for number, step in enumerate(plan.steps, 1):
        ports = {name: names.objects[value] for name, value in step.arguments.items()}
        for what, where in (("start", step.start), ("goal", step.goal)):
            ports |= {f"{what}_{axis}": repr(value) for axis, value in zip(domain.vocabulary.axes, where, strict=False)}
        attributes = {
            "name": f"{number}-{names.operators[step.operator]}",
            **_ports(ports),
            "duration": repr(step.duration),
        }
        SubElement(sequence, nodes[step.operator], attributes)
    used = {step.operator for step in plan.steps}
    _model(root, domain, names, [operator for operator in domain.operators if operator.name in used], ())
    return _text(root)


def domain_to_behavior_tree(domain: Domain) -> str:
    """Return the operators of a domain as subtrees, with the model of their nodes."""
    names = Names(domain)
    nodes = node_ids(names)
    usable = [operator for operator in domain.operators if operator.usable]
    root = Element("root", _ROOT)
    conditions: set[str] = set()
    for operator in usable:
        tree = SubElement(root, "BehaviorTree", {"ID": f"Do{nodes[operator.name]}"})
        fallback = SubElement(tree, "Fallback", {"name": names.operators[operator.name]})
        for name, literals in (("done", operator.effects), ("act", operator.preconditions)):
            sequence = SubElement(fallback, "Sequence", {"name": name})
            conditions |= {_condition(sequence, literal, names) for literal in literals}
        ports = {parameter.name: f"{{{parameter.name}}}" for parameter in operator.parameters}
        for what in ("start", "goal") if operator.places else ():
            ports |= {f"{what}_{axis}": f"{{{what}_{axis}}}" for axis in domain.vocabulary.axes}
        SubElement(
            sequence, nodes[operator.name],
            {"name": names.operators[operator.name], **_ports(ports), "duration": repr(operator.duration)},
        )  # fmt: skip
    _model(root, domain, names, usable, sorted(conditions))
    return _text(root)


def node_ids(names: Names) -> dict[str, str]:
    """Return operator -> its node, in words with capital letters, as PourTea; each of its own."""
    taken = {name.lower() for name in _OWN} | {f"is{_words(text)}".lower() for text in names.predicates.values()}
    nodes: dict[str, str] = {}
    for operator, identifier in names.operators.items():
        node, number = _words(identifier), 1
        while node.lower() in taken:
            number += 1
            node = f"{_words(identifier)}N{number}"
        taken.add(node.lower())
        nodes[operator] = node
    return nodes


def _words(identifier: str) -> str:
    return "".join(part.capitalize() for part in identifier.replace("_", "-").split("-"))


def _ports(ports: Mapping[str, str]) -> dict[str, str]:
    return {name.replace("-", "_"): value for name, value in ports.items()}


def _condition(parent: Element, literal: Literal, names: Names) -> str:
    """Add a node that tells whether a literal holds; return its name."""
    holder = parent if literal.value else SubElement(parent, "Inverter")
    name = f"Is{_words(names.predicates[literal.predicate])}"
    arguments = {
        f"argument_{k}": f"{{{argument.replace('-', '_')}}}" for k, argument in enumerate(literal.arguments, 1)
    }
    SubElement(holder, name, {"name": names.predicates[literal.predicate], **arguments})
    return f"{name} {len(literal.arguments)}"


def _model(
    root: Element, domain: Domain, names: Names, operators: Iterable[Operator], conditions: Iterable[str]
) -> None:
    """Add the types of all ports."""
    model, nodes = SubElement(root, "TreeNodesModel"), node_ids(names)
    for condition in conditions:
        name, count = condition.split(" ")
        node = SubElement(model, "Condition", {"ID": name})
        for k in range(1, int(count) + 1):
            SubElement(node, "input_port", {"name": f"argument_{k}", "type": "std::string"})
    for operator in operators:
        node = SubElement(model, "Action", {"ID": nodes[operator.name]})
        for parameter in operator.parameters:
            SubElement(node, "input_port", {"name": parameter.name.replace("-", "_"), "type": "std::string"})
        axes = domain.vocabulary.axes if operator.places else ()
        for name in [*(f"{what}_{axis}" for what in ("start", "goal") for axis in axes), "duration"]:
            SubElement(node, "input_port", {"name": name, "type": "double"})


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
