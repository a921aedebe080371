"""Shooting and bouncing rays: physical optics of a target, bounce by bounce."""
