"""What a search does with the effects of its model but adding one: exchange, look ahead, drop."""
