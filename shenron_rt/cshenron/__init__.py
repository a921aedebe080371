"""The public C-Shenron pipeline, clean-room: its points, loss, ADC samples, images and detector."""
