"""The paper's training: the decision process, episodes, replay, the Q network, and its export."""
