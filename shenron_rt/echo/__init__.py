"""Echo models: what a scatterer sends back."""
