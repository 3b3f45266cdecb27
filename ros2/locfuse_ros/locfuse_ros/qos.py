# SPDX-License-Identifier: Apache-2.0
"""How topics are heard and told, and what is said where two sides do not fit."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy

QUEUE = 100  # messages of ours that wait for a subscriber who is slow
LATCHED = 100  # as many publishers of tf_static may have told theirs before the node came

_WORDS = {
    QoSPolicyKind.DURABILITY: "durability",
    QoSPolicyKind.RELIABILITY: "reliability",
    QoSPolicyKind.DEADLINE: "deadline",
    QoSPolicyKind.LIVELINESS: "liveliness",
}


def to_hear(latched: bool, queue: int) -> QoSProfile:
    """Return how a topic is heard.

    What is latched must be offered reliable and transient local. Of all else best effort is
    enough, so that publishers that are reliable fit as well as those that are not.
    """
    if latched:
        return QoSProfile(
            depth=max(queue, LATCHED),
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
    return QoSProfile(
        depth=queue,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )


def to_tell(latched: bool) -> QoSProfile:
    """Return how a topic is told: reliable, and if it is latched, to those who come later."""
    return QoSProfile(
        depth=1 if latched else QUEUE,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def does_not_hear(topic: str, policy: QoSPolicyKind, asked: QoSProfile) -> str:
    """Return what to say of a publisher whose messages do not arrive."""
    return (
        f"QoS mismatch on {topic}: none of a publisher's messages arrive, as its "
        f"{_WORDS.get(policy, policy.name.lower())} is less than this node asks for, "
        f"{_asked(policy, asked)}; start the publisher with that"
    )


def is_not_heard(topic: str, policy: QoSPolicyKind, offered: QoSProfile) -> str:
    """Return what to say of a subscriber whom our messages do not reach."""
    return (
        f"QoS mismatch on {topic}: a subscriber hears nothing, as the "
        f"{_WORDS.get(policy, policy.name.lower())} that it asks for is more than this node "
        f"offers, {_asked(policy, offered)}; start the subscriber with that"
    )


def _asked(policy: QoSPolicyKind, profile: QoSProfile) -> str:
    if policy == QoSPolicyKind.DURABILITY:
        return profile.durability.name.lower()
    if policy == QoSPolicyKind.RELIABILITY:
        return profile.reliability.name.lower()
    return "none"
