"""What a laser job needs to know besides the layout: options, machines, materials; and the kerf from a photo."""
