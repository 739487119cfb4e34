"""Lower bounds with proof: claims, certificates, and the search for them."""
