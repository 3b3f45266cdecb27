# SPDX-License-Identifier: Apache-2.0
"""QoS profiles of subscriptions and publishers, and warnings on mismatches."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy

QUEUE = 100  # outgoing messages queued for a slow subscriber
LATCHED = 100  # maximum publishers of tf_static that published before the node started

_WORDS = {
    QoSPolicyKind.DURABILITY: "durability",
    QoSPolicyKind.RELIABILITY: "reliability",
    QoSPolicyKind.DEADLINE: "deadline",
    QoSPolicyKind.LIVELINESS: "liveliness",
}


def subscriber_qos(latched: bool, queue: int) -> QoSProfile:
    """Return the QoS of a subscription.

    Latched topics require reliable, transient local publishers. All others request best effort, so
    that reliable and best-effort publishers are both compatible.
    """
    if latched:
        return QoSProfile(
            depth=max(queue, LATCHED),
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
    return QoSProfile(
        depth=queue, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE
    )


def publisher_qos(latched: bool) -> QoSProfile:
    """Return the QoS of a publisher: reliable, and transient local if latched."""
    return QoSProfile(
        depth=1 if latched else QUEUE,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def publisher_mismatch(topic: str, policy: QoSPolicyKind, asked: QoSProfile) -> str:
    """Return the warning about a publisher with incompatible QoS."""
    return (
        f"QoS mismatch on {topic}: no messages of a publisher are received, as its "
        f"{_WORDS.get(policy, policy.name.lower())} is lower than this node requests, "
        f"{_asked(policy, asked)}; start the publisher with that"
    )


def subscriber_mismatch(topic: str, policy: QoSPolicyKind, offered: QoSProfile) -> str:
    """Return the warning about a subscriber with incompatible QoS."""
    return (
        f"QoS mismatch on {topic}: a subscriber receives nothing, as the "
        f"{_WORDS.get(policy, policy.name.lower())} that it requests is higher than this node "
        f"offers, {_asked(policy, offered)}; start the subscriber with that"
    )


def _asked(policy: QoSPolicyKind, profile: QoSProfile) -> str:
    if policy == QoSPolicyKind.DURABILITY:
        return profile.durability.name.lower()
    if policy == QoSPolicyKind.RELIABILITY:
        return profile.reliability.name.lower()
    return "none"
