"""Joints of KUKA controllers by RSI, the RobotSensorInterface of KR C4 and KR C5: XML in UDP datagrams, every 4 or 12 ms.

KUKA, *KUKA.RobotSensorInterface* (3.x and 4.x): the controller sends ``<Rob>`` with what its configuration names under ``SEND``.
With ``ONLYSEND`` it expects no answer, and none can move the robot; Taskcal gives none.
"""

from collections.abc import Mapping

from taskcal_devices.network import DatagramJoints, xml_of


class Rsi(DatagramJoints):
    """A controller of KUKA, whose RSI sends its actual axis positions."""

    name = "rsi"
    reached = "HOST[:59152][?from=HOST][&joints=NAME,…]"
    port = 59152
    hint = (
        "see that RSI runs there, with DEF_AIPos and ONLYSEND TRUE, and this computer's address as IP_NUMBER and PORT"
    )

    @staticmethod
    def parse(content: bytes) -> tuple[float, Mapping[str, float], Mapping[str, float]]:
        """Time stamp (IPOC, milliseconds), axes ``A1`` … of AIPos, and external axes ``E1`` … of EIPos.

        Raises:
            ValueError: it is not ``<Rob>``, or lacks stamp or axes.
        """
        root = xml_of(content)
        if root.tag != "Rob":
            raise ValueError(f"<{root.tag}> instead of <Rob>")
        if (axes := root.first("AIPos")) is None:
            raise ValueError("no AIPos; add DEF_AIPos to SEND of the controller's configuration of RSI")
        external = root.first("EIPos")
        if (stamp := root.first("IPOC")) is None:
            raise ValueError("no IPOC")
        return (
            float(int(stamp.text)) / 1e3,
            {name: float(value) for name, value in axes.attributes.items()},
            {name: float(value) for name, value in ({} if external is None else external.attributes).items()},
        )
