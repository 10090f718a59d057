"""Movements of live sensors become symbols: samples in by LSL, OSC or ROS 2, symbols out."""
