tool
extends VBoxContainer
# The options, a button, and what came of it.

signal wanted

const QUALITIES = ["fast", "balanced", "best"]

var _threshold
var _max_hulls
var _quality
var _command
var _said


func _init():
	name = "rlacd"
	_threshold = _number("Threshold", 0.05, 0.001, 2.0, 0.001,
		"How far a shape may lie from the surface, where the longest side is 2: 0.02 is fine, 0.2 coarse.")
	_max_hulls = _number("Most shapes", 0, 0, 4096, 1, "Per mesh; 0 for any number.")
	_quality = OptionButton.new()
	for word in QUALITIES:
		_quality.add_item(word)
	_quality.select(1)
	_row("Quality", _quality, "How long to search for fewer shapes.")
	_command = LineEdit.new()
	_command.text = "rlacd"
	_row("Command", _command, "The program, or its path: pip install rlacd")
	var button = Button.new()
	button.text = "Make convex hulls"
	button.hint_tooltip = "For every mesh in the selected nodes. Earlier ones are replaced."
	button.connect("pressed", self, "emit_signal", ["wanted"])
	add_child(button)
	_said = Label.new()
	_said.autowrap = true
	add_child(_said)


func say(text):
	_said.text = text


func command():
	return _command.text


# The options of `rlacd decompose`.
func options():
	var given = ["--threshold", str(_threshold.value), "--quality", QUALITIES[_quality.selected]]
	if _max_hulls.value > 0:
		given += ["--max-hulls", str(int(_max_hulls.value))]
	return given


func _number(title, value, least, most, step, hint):
	var box = SpinBox.new()
	box.min_value = least
	box.max_value = most
	box.step = step
	box.value = value
	_row(title, box, hint)
	return box


func _row(title, control, hint):
	var row = HBoxContainer.new()
	var label = Label.new()
	label.text = title
	label.size_flags_horizontal = SIZE_EXPAND_FILL
	row.hint_tooltip = hint
	control.hint_tooltip = hint
	control.size_flags_horizontal = SIZE_EXPAND_FILL
	row.add_child(label)
	row.add_child(control)
	add_child(row)
