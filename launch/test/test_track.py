"""The client of the servo: a goal that is cancelled before the servo has answered."""


import pytest
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from std_srvs.srv import SetBool
from unique_identifier_msgs.msg import UUID

from edge_tracking import track as track_module
from edge_tracking.graph import Graph
from edge_tracking.track import Exit, TrackNode
from tactile_msgs.action import TrackEdge
from tactile_msgs.msg import ServoReason, ServoStatus
from tactile_servo.reasons import ReasonCode


class Servo(Node):
    """Takes a goal, and works on it until it is cancelled."""

    def __init__(self, **kwargs):
        super().__init__('servo', **kwargs)
        self.goals = []
        self._server = ActionServer(
            self, TrackEdge, 'track_edge', self._finish,
            handle_accepted_callback=self.goals.append, cancel_callback=self._on_cancel)
        self.beats = []
        self.create_subscription(UUID, 'edge_servo/heartbeat', self.beats.append, 1)
        self.create_timer(0.02, self._look)

    def _on_cancel(self, _):
        return CancelResponse.ACCEPT

    def _look(self):
        if self.goals and self.goals[0].is_cancel_requested:
            self.goals.pop().execute()

    def _finish(self, goal):
        goal.canceled()
        return TrackEdge.Result(reason='cancelled', reason_code=ReasonCode.CANCELLED)

    def destroy_node(self):
        self._server.destroy()
        super().destroy_node()


@pytest.fixture
def graph():
    with Graph() as made:
        yield made


def wait(graph, condition):
    graph.spin(condition, 20.0)
    assert condition()


def ready(graph, robot=True, **parameters):
    """Give servo and client, with all that the client waits for, or without the robot."""
    servo, track = graph.add(Servo), graph.add(TrackNode, **parameters)
    wait(graph, track._client.server_is_ready)
    wait(graph, track._heartbeat.get_subscription_count)
    track._seen = track._tared = track._felt = True
    track._robot = robot
    return servo, track


def test_a_goal_cancelled_before_it_is_sent_is_never_sent(graph):
    servo, track = ready(graph, robot=False)
    track.cancel()
    assert track.finished and not track.success and track.reason == 'cancelled'
    track._robot = True
    graph.spin(lambda: False, 0.3)  # several periods of what would send it
    assert not servo.goals


def test_a_goal_cancelled_before_it_is_accepted_is_cancelled_then(graph):
    servo, track = ready(graph, robot=False)
    track._robot = True
    track._try_to_start()
    track.cancel()
    assert not track.finished
    wait(graph, lambda: track.finished)
    assert not track.success and track.reason == 'cancelled' and not servo.goals
    assert track.reason_code == ReasonCode.CANCELLED
    assert track.exit == Exit.NOT_TRACKED


@pytest.mark.parametrize('state, reason', [
    (ServoStatus.IDLE, 'goal rejected: too fast'),
    (ServoStatus.TRACK, 'goal rejected: another one is active')])
def test_a_refusal_has_its_own_reason_not_that_of_another_goal(graph, state, reason):
    track = graph.add(TrackNode)
    track._on_refusal(ServoStatus(state=state, reason='goal rejected: too fast'))
    assert track.exit == Exit.REFUSED and track.reason == reason


def test_a_servo_that_falls_silent_ends_the_client(graph, monkeypatch):
    monkeypatch.setattr(track_module, 'SILENCE', 0.5)
    servo, track = ready(graph)
    wait(graph, lambda: servo.goals)  # and not a word more
    assert not track.finished
    wait(graph, lambda: track.finished)
    assert track.exit == Exit.SILENT and 'has said nothing for' in track.reason


@pytest.mark.parametrize('timeout', [0.0, 0.2])
def test_a_client_says_that_it_lives_while_its_goal_is_worked_on(graph, timeout):
    servo, track = ready(graph, client_timeout=timeout)
    wait(graph, lambda: servo.goals)
    assert servo.goals[0].request.client_timeout == timeout
    wait(graph, lambda: track._handle is not None)
    goal_id = servo.goals[0].goal_id
    graph.spin(lambda: False, 0.5)
    assert all(beat == goal_id for beat in servo.beats)
    assert bool(servo.beats) == bool(timeout)
    track.cancel()
    wait(graph, lambda: track.finished)
    count = len(servo.beats)
    graph.spin(lambda: False, 0.2)
    assert len(servo.beats) <= count + 1


@pytest.mark.parametrize('resumes', [0, 2])
def test_a_servo_that_could_go_on_is_asked_to_as_often_as_allowed_and_once_a_hold(graph, resumes):
    servo, track = ready(graph, robot=False, resumes=resumes)
    asked = []

    def on_pause(request, response):
        asked.append(request.data)
        return response

    servo.create_service(SetBool, 'edge_servo/pause', on_pause)
    wait(graph, track._pause.service_is_ready)
    track._robot = True
    wait(graph, lambda: servo.goals)
    went_on = TrackEdge.Feedback(state=ServoStatus.TRACK)
    told = [TrackEdge.Feedback(state=ServoStatus.HOLD, reason_code=code) for code in (
        ServoReason.STALLED, ServoReason.INPUT_BACK, ServoReason.INPUT_BACK)]
    for turn in range(3):
        for feedback in (*told, went_on):
            feedback.progress = track.feedback.progress + 1.0 if track.feedback else 0.0
            servo.goals[0].publish_feedback(feedback)
            wait(graph, lambda it=feedback: track.feedback == it)
        wait(graph, lambda turn=turn: len(asked) >= min(turn + 1, resumes))
    assert asked == resumes * [False]


def test_a_goal_that_cannot_be_recorded_is_not_sent(graph, tmp_path, capfd):
    servo, track = graph.add(Servo), graph.add(TrackNode, record=str(tmp_path))  # is there
    wait(graph, lambda: track.finished)
    assert track.exit == Exit.REFUSED and 'is not recorded' in track.reason
    assert not servo.goals and str(tmp_path) in capfd.readouterr().err
