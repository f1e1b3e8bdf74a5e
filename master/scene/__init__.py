"""What a scene may say."""
